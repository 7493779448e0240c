use host_sim::full_memory::FullMemory;
use springpot::*;
fn rms(a:&[f64],b:&[f64])->f64{let n=b.len() as f64;let m=b.iter().sum::<f64>()/n;let v=b.iter().map(|x|(x-m).powi(2)).sum::<f64>()/n;let e=a.iter().zip(b).map(|(x,y)|(x-y).powi(2)).sum::<f64>()/n;(e/v).sqrt()}
fn main(){
  let sp=Springpot::new; let _=FullMemory::new(1,1.0);
  for (c,a) in [(100.,0.0),(100.,0.02),(100.,0.1),(100.,0.2),(1000.,0.02),(1e4,0.02),(1e5,0.02)]{
  let m=Maxwell::new(sp(c,a),&[],Topology::Parallel,0.316).unwrap();
  for rate in [100.,1000.,5000.]{ let h=1./rate; let n=(155.*rate) as usize+1;
    let k=8.8541878128e-12*4.7*0.04*0.06/(160e-6f64*160e-6);
    let f:Vec<f64>=(0..n).map(|i|{let v=3000.*(1.-(std::f64::consts::TAU*i as f64*h/7.).cos());k*v*v}).collect();
      let law=Law::<f64>::compressed(&m,Options::at_step(h).with_tolerance(1.0)).unwrap();
      let law32=Law::<f32>::compressed(&m,Options::at_step(h).with_tolerance(1.0)).unwrap();
      let mut st=law.state(); let x:Vec<f64>=f.iter().map(|&f|law.displacement(&mut st,f)).collect();
      let mut st=law.state(); let xq:Vec<f64>=f.iter().map(|&f|law.displacement(&mut st,f as f32 as f64)).collect();
      let mut st=law32.state(); let x32:Vec<f64>=f.iter().map(|&f|law32.displacement(&mut st,f as f32) as f64).collect();
      let half=n/2;
      println!("c {c} a {a} rate {rate} quantised input {:.1e} f32 {:.1e} (first half {:.1e}, second {:.1e}) mean err {:.1e}",rms(&xq,&x),rms(&x32,&x),rms(&x32[..half],&x[..half]),rms(&x32[half..],&x[half..]),x32.iter().zip(&x).map(|(a,b)|a-b).sum::<f64>()/n as f64/x[n/2].abs());
    }}
}
